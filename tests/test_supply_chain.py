"""What the package takes from others: the bill of materials names each vendored file with its digest."""

import hashlib
import json
import re
import tomllib

from programs import ROOT

SBOM = "kpopnet.cdx.json"


def test_vendored_files_are_those_of_the_bill_of_materials() -> None:
    bill = json.loads((ROOT / SBOM).read_text())
    listed = {one["properties"][0]["value"]: one["hashes"][0]["content"] for one in bill["components"]}
    page = (ROOT / "kpopnet/teacher/page/vendor").rglob("*")
    vendored = [path for path in page if path.is_file() and path.suffix not in (".LICENSE", ".md")]
    vendored += (ROOT / "synth/assets").glob("*.npz")
    assert listed == {path.relative_to(ROOT).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in vendored}


def test_a_slim_installation_leaves_out_what_trains_and_simulates() -> None:
    required = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    listed = re.search(r"^pip install (numpy .*)$", (ROOT / "docs/predicting.md").read_text(), re.MULTILINE)[1].split()
    left_out = {re.match(r"[\w-]+", one)[0] for one in required} - set(listed)
    assert left_out == {"torch", "mujoco", "hydra-core", "tensorboard"} and len(listed) == len(required) - len(left_out)


def test_the_wheel_carries_the_bill_of_materials() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert settings["tool"]["hatch"]["build"]["targets"]["wheel"]["sbom-files"] == [SBOM]
