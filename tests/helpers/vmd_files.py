"""Motions as MikuMikuDance's files."""

import struct

LINEAR = (20, 20, 107, 107)


def write_vmd(path, bones, curve=LINEAR, switches=(), cameras=0):
    """Writes keys (frame, place, quaternion x, y, z, w) by bone, in the file's own axes and units.

    `curve` is x1, y1, x2, y2 of all keys; `switches` are (frame, IK's bone, on).
    """
    first = bytes(number for number in curve for _ in range(4))
    rows = b"".join(first[row:] + bytes([1] * row) for row in range(4))
    rows = rows[:2] + b"\0\0" + rows[4:]  # where newer versions say whether physics are on
    keys = b""
    for bone, own in bones.items():
        for frame, place, quat in own:
            after = bytes([0xFD - frame % 2])  # what follows the end of the text is any bytes
            name = bone.encode("cp932").ljust(14, b"\0")[:14] + after
            keys += struct.pack("<15sI3f4f", name, frame, *place, *quat) + rows
    count = sum(map(len, bones.values()))
    name = "初音ミク".encode("cp932").ljust(20, b"\0")
    content = b"Vocaloid Motion Data 0002".ljust(30, b"\0") + name + struct.pack("<I", count) + keys
    content += struct.pack("<I", 1) + b"\x82\xa0".ljust(23, b"\0") + struct.pack("<I", cameras) + bytes(61 * cameras) + bytes(8)
    content += struct.pack("<I", len(switches))
    for frame, bone, on in switches:
        content += struct.pack("<IBI20sB", frame, 1, 1, bone.encode("cp932"), on)
    path.write_bytes(content)
    return path
