"""Mutations of files in their own terms, which reach behind checksums: what a parser unpacks, not what it reads first.

Each takes a path and a generator, changes the file in place, and gives what the change demands, if anything: `hostile.TELLS`,
`NEVER` or `WILD`.
"""

import contextlib
import functools
import io
import json
import pickle
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np

from fuzz.hostile import (
    ANY,
    BOMB_PX,
    EXPRESSION,
    HOSTILE_VALUES,
    NEVER,
    SECRET,
    TELLS,
    WILD,
    Maker,
    flip_bytes,
    mutate,
    packed_zeros,
    pick,
)

HOSTILE_ARRAYS = (
    np.zeros(0), np.float64(np.nan), np.full((3, 3), np.inf), np.array(["x"]), np.array("\x1b[31m\n"), np.int8(-1),
    np.zeros((1, 2, 3, 4, 5)), np.zeros((2, 0, 4)), np.full(50, -1), np.float64(1e300), np.array([b"x"]), np.zeros(3, bool),
    np.zeros(2, complex),
)  # fmt: skip

IMMENSE = ((2**40, 3), (2**20, 2**10, 4))
"""Shapes of terabytes."""


def damage(path: Path, start: int, size: int, rng: np.random.Generator) -> str:
    """Changes one to eight bytes of a part of a file that has a checksum."""
    data = bytearray(path.read_bytes())
    data[start : start + size] = flip_bytes(bytes(data[start : start + size]), rng)
    path.write_bytes(data)
    return TELLS


# --- numpy, archives --------------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def members_of(path: Path) -> Iterator[dict[str, bytes]]:
    """The members of an archive by name, to be changed; it is packed anew."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    yield members
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(zipfile.ZipInfo(name), content)


def npy(rng: np.random.Generator) -> bytes:
    """Another array in numpy's format; or a header that declares terabytes; or a pickle."""
    stream, hidden = io.BytesIO(), np.empty(1, object)
    hidden[0] = Maker()
    chosen = pick(rng, (*HOSTILE_ARRAYS, *IMMENSE, hidden, hidden))
    if isinstance(chosen, tuple):
        np.lib.format.write_array_header_1_0(stream, {"descr": "<f8", "fortran_order": False, "shape": chosen})
    else:
        np.lib.format.write_array(stream, np.asanyarray(chosen), allow_pickle=True)
    return stream.getvalue()


def mutate_npy(path: Path, rng: np.random.Generator) -> None:
    path.write_bytes(npy(rng))


def mutate_npz(path: Path, rng: np.random.Generator) -> str | None:
    """Another array or a bomb in the place of one; a renamed one; or damage that the archive's checksum tells."""
    with zipfile.ZipFile(path) as archive:
        chosen, action = pick(rng, archive.infolist()), rng.random()
    if action < 0.25:
        head = chosen.header_offset
        sizes = struct.unpack_from("<HH", path.read_bytes(), head + 26)
        return damage(path, head + 30 + sum(sizes), chosen.compress_size, rng)
    if action < 0.28:
        path.write_bytes(_npz_bomb(chosen.filename))
        return ANY
    with members_of(path) as members:
        members[chosen.filename] = npy(rng)
        if action < 0.35:
            members[chosen.filename.replace(".npy", "_.npy")] = members.pop(chosen.filename)
    return ANY


@functools.cache
def _npz_bomb(name: str) -> bytes:
    """An archive of 400 KB whose array takes 400 MB."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive, archive.open(name, "w") as member:
        np.lib.format.write_array_header_1_0(member, {"descr": "<f4", "fortran_order": False, "shape": (10**5, 1000)})
        for _ in range(400):
            member.write(bytes(10**6))
    return packed.getvalue()


@functools.cache
def _lzfse_bomb() -> bytes:
    """Zeros that LZFSE takes 8 s to pack."""
    import lzfse

    return lzfse.compress(bytes(BOMB_PX**2))


def mutate_r3d(path: Path, rng: np.random.Generator) -> None:
    """A member of the archive changed before it is packed, its images in what LZFSE packs; or exchanged; or missing."""
    import lzfse

    with members_of(path) as members:
        name, action = pick(rng, sorted(members)), rng.random()
        if action < 0.2:
            del members[name]
        elif action < 0.3:
            members[name] = members[pick(rng, sorted(members))]
        elif action < 0.35:
            members[name] = _lzfse_bomb()
        elif action < 0.6 and name.startswith("rgbd"):
            members[name] = lzfse.compress(mutate(lzfse.decompress(members[name]), rng))
        else:
            members[name] = mutate(members[name] or b"x", rng)


def mutate_state(path: Path, rng: np.random.Generator) -> str:
    """A member of torch's archive changed; or the pickle in it replaced by one that runs code."""
    hidden = rng.random() < 0.5
    with members_of(path) as members:
        name = next(one for one in members if one.endswith("data.pkl")) if hidden else pick(rng, sorted(members))
        members[name] = pickle.dumps(Maker(), protocol=2) if hidden else mutate(members[name] or b"x", rng)
    return NEVER if hidden else ANY


# --- text -----------------------------------------------------------------------------------------------------------------


def mutate_bvh(path: Path, rng: np.random.Generator) -> None:
    """Another word where the format says how much follows; or joints in joints in joints."""
    text = path.read_text()
    if rng.random() < 0.2:
        depth = int(rng.integers(10, 3000))
        block = "JOINT a{}\n{{\nOFFSET 0 0 1\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
        nested = "".join(block.format(number) for number in range(depth)) + "}\n" * depth
        path.write_text(text.replace("JOINT", f"{nested}JOINT", 1))
        return
    field = pick(rng, ("Frames: ", "Frame Time: ", "CHANNELS ", "OFFSET ", "JOINT ", "ROOT "))
    word = pick(rng, ("999999999", "0", "-1", "41", "39", "1e9", "4 4", "1e-9", "nan", "", "\u0661", "\x1b[31m", EXPRESSION))
    place = pick(rng, [match.end() for match in re.finditer(field, text)])
    path.write_text(text[:place] + word + text[place:].lstrip("0123456789.-"))


def mutate_names(path: Path, rng: np.random.Generator) -> str:
    """Names that lead elsewhere."""
    names = json.loads(path.read_text())
    chosen = pick(rng, sorted(names))
    ways = ("../outside", "{}/../../outside", "{}\x00", "{}\n", "/etc", "{}/.", "..", "", "\u0661", "{} ", "\ud800")
    names[chosen] = pick(rng, ways).format(names[chosen])
    path.write_text(json.dumps(names))
    return NEVER


def mutate_deeds(path: Path, rng: np.random.Generator) -> str:
    """Another thing that a parser does on hostile bytes."""
    deed = pick(rng, ("hang", "sleep", "swell", "crash", "exit", "leave", "raise", "print", "refuse"))
    path.write_text(json.dumps({"do": deed}))
    return ANY if deed == "print" else NEVER


# --- images ---------------------------------------------------------------------------------------------------------------


def mutate_png(path: Path, rng: np.random.Generator) -> str:
    """Changes chunks and makes their checksums again; or damages pixels without; or a bomb."""
    data = path.read_bytes()
    chunks, place = list[tuple[bytes, bytes]](), 8
    while place < len(data):
        (size,) = struct.unpack_from(">I", data, place)
        chunks.append((data[place + 4 : place + 8], data[place + 8 : place + 8 + size]))
        place += size + 12
    pixels = next(index for index, (kind, _) in enumerate(chunks) if kind == b"IDAT")
    action = int(rng.integers(8))
    if action < 2:
        return damage(path, data.index(b"IDAT") + 4, len(chunks[pixels][1]), rng)
    if action == 2:  # pixels behind the checksum
        raw = zlib.decompress(chunks[pixels][1])
        chunks[pixels] = b"IDAT", zlib.compress(pick(rng, (raw[: len(raw) // 2], raw + raw, flip_bytes(raw, rng))))
    elif action == 3:
        chunks[0] = b"IHDR", flip_bytes(chunks[0][1], rng)
    elif action == 4:
        header = struct.pack(">II", BOMB_PX, BOMB_PX) + chunks[0][1][8:]
        chunks = [(b"IHDR", header), (b"IDAT", packed_zeros(BOMB_PX * (1 + 2 * BOMB_PX))), (b"IEND", b"")]
    elif action == 5:
        text = pick(rng, (b"key\x00" + b"x" * 100_000, b"key\x00\x00" + packed_zeros(BOMB_PX * BOMB_PX), rng.bytes(50), b""))
        chunks.insert(1, (pick(rng, (b"tEXt", b"zTXt", b"iTXt", b"iCCP", b"acTL", b"eXIf", b"tRNS", b"PLTE", b"gAMA")), text))
    elif action == 6:
        chunks.insert(int(rng.integers(len(chunks))), pick(rng, chunks))
    else:
        victim = int(rng.integers(len(chunks)))
        kind, content = chunks[victim]
        chunks[victim] = kind, flip_bytes(content, rng) if content else b"x"
    packed = [struct.pack(">I", len(one)) + kind + one + struct.pack(">I", zlib.crc32(kind + one)) for kind, one in chunks]
    path.write_bytes(data[:8] + b"".join(packed))
    return NEVER if action == 4 else ANY


def mutate_video(path: Path, rng: np.random.Generator) -> str:
    """Damages the packed pixels of a frame, each of whose slices has a checksum."""
    import av

    with av.open(str(path)) as container:
        packets = [bytes(packet) for packet in container.demux(video=0) if packet.size]
    packet = pick(rng, packets)
    return damage(path, path.read_bytes().index(packet), len(packet), rng)


# --- HDF5 -----------------------------------------------------------------------------------------------------------------


def mutate_hdf5(path: Path, rng: np.random.Generator) -> str:
    """Damages stored chunks, or changes arrays, attributes, names and links by the library itself."""
    with h5py.File(path, "r+") as file:
        arrays: dict[str, h5py.Dataset] = {}
        file.visititems(lambda name, one: arrays.update({name: one}) if isinstance(one, h5py.Dataset) else None)
        packed = [one for one in arrays.values() if one.compression == "gzip" and one.id.get_num_chunks()]
        action = int(rng.integers(10))
        if action < 4 and packed:
            array = pick(rng, packed)
            chunk = array.id.get_chunk_info(int(rng.integers(array.id.get_num_chunks())))
            file.close()
            return damage(path, chunk.byte_offset, chunk.size, rng)
        name = pick(rng, list(arrays))
        if action < 9:
            pick(rng, (_replace, _link, _attribute, _swell, _rename))(file, name, rng)
            return ANY
        if arrays[
            name
        ].chunks:  # one that is no output of its filters, or skips them and is short: HDF5 adds what was in memory
            arrays[name].id.write_direct_chunk((0,) * arrays[name].ndim, rng.bytes(50), filter_mask=int(rng.integers(4)))
    return WILD


def _replace(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    del file[name]
    kinds = (
        np.zeros(3, [("x", "f4"), ("y", "i2")]), np.array(["text"], h5py.string_dtype()), np.zeros(2, "V8"),
        np.array([file.ref], h5py.ref_dtype), h5py.Empty("f4"), *HOSTILE_ARRAYS,
    )  # fmt: skip
    with contextlib.suppress(TypeError):  # what HDF5 cannot hold is missing then
        file[name] = pick(rng, kinds)


def _link(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    """The same array, of numbers that lie in another file."""
    shape, kind = file[name].shape, file[name].dtype
    if kind.kind not in "fiu":
        return
    numbers = np.full(shape, SECRET if kind.kind == "f" else min(round(1000 * SECRET), np.iinfo(kind).max), kind)
    del file[name]
    secret = str(Path("../outside/secret").resolve())
    way = int(rng.integers(3))
    if way == 0:
        Path(secret).write_bytes(numbers.tobytes())
        file.create_dataset(name, shape, kind, external=[(secret, 0, numbers.nbytes)])
        return
    with h5py.File(secret, "w") as other:
        other["numbers"] = numbers
    if way == 1:
        file[name] = h5py.ExternalLink(secret, "numbers")
    else:
        layout = h5py.VirtualLayout(shape, kind)
        layout[...] = h5py.VirtualSource(secret, "numbers", shape)
        file.create_virtual_dataset(name, layout)


def _attribute(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    known = list(file.attrs) or ["fps"]
    values = (*HOSTILE_VALUES, *HOSTILE_ARRAYS, EXPRESSION, h5py.Empty("f4"), "\x1b]0;title\x07\n")
    with contextlib.suppress(TypeError, ValueError, OverflowError):  # what an attribute cannot hold
        file.attrs[pick(rng, known)] = pick(rng, values)


def _swell(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    """An array that declares terabytes without a byte of content, or one chunk of an immense image."""
    kind = file[name].dtype if file[name].dtype.kind in "fiu" else np.dtype("u2")
    del file[name]
    if rng.random() < 0.5:
        file.create_dataset(name, (2**20, 2**14, 2**14), kind, chunks=(1, 2**10, 2**10))
    else:
        sides = (1, BOMB_PX, BOMB_PX)
        array = file.create_dataset(name, sides, "u2", chunks=sides, compression="gzip")
        array.id.write_direct_chunk((0, 0, 0), packed_zeros(2 * BOMB_PX * BOMB_PX))


def _rename(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    file.move(name, pick(rng, ("line\nbreak", "\x1b[31mred\x1b[0m", "\x9b2J", "\u202eright", "a/b/c", "x" * 5000, "..")))


STRUCTURED: dict[str, Callable[[Path, np.random.Generator], str | None]] = {
    ".bvh": mutate_bvh, ".npy": mutate_npy, ".npz": mutate_npz, ".r3d": mutate_r3d, ".png": mutate_png,
    ".mkv": mutate_video, ".h5": mutate_hdf5, ".pt": mutate_state, "names.json": mutate_names, "deed.json": mutate_deeds,
}  # fmt: skip
"""By the ending of a file's name, or its whole name."""


def mutate_file(path: Path, rng: np.random.Generator, is_own: bool) -> str:
    """Mutates a file in place, of the known kinds half of the time in their own terms; what the change demands."""
    own = STRUCTURED.get(path.name)
    if own is None and (rng.random() < 0.5 or (is_own and path.suffix == ".h5")):
        own = STRUCTURED.get(path.suffix)
    if own is not None:
        return own(path, rng) or ANY
    path.write_bytes(mutate(path.read_bytes(), rng))
    return WILD if path.suffix == ".h5" else ANY
