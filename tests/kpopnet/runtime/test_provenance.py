"""The command that installs an extra: kpopnet is on no package index, so it names the checkout or the wheel."""

import json
import os
import shutil
import subprocess
import sys

import pytest
from programs import ROOT

from kpopnet.errors import InputError
from kpopnet.runtime.provenance import install_command, optional_library


def test_a_missing_library_is_named_with_the_checkout_and_its_extra():
    with (
        pytest.raises(InputError, match=r"a\.mkv: needs PyAV, which does not load \(No module .*\); install it: pip install"),
        optional_library("a.mkv", "PyAV", "video"),
    ):
        import no_such_library  # noqa: F401
    assert install_command("video") == f"pip install -e '{ROOT}[video]'"


def test_an_installed_package_names_its_wheel(tmp_path):
    origin = "file:///wheels/kpopnet-0.1.0-py3-none-any.whl"
    for module in ("__init__", "errors", "runtime/__init__", "runtime/provenance"):
        path = tmp_path / "kpopnet" / f"{module}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "kpopnet" / f"{module}.py", path)
    about = tmp_path / "kpopnet-0.1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: kpopnet\nVersion: 0.1.0\n")
    (about / "direct_url.json").write_text(json.dumps({"url": origin}))
    code = "from kpopnet.runtime.provenance import install_command; print(install_command('app'))"
    command = [sys.executable, "-P", "-S", "-c", code]
    done = subprocess.run(command, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True)
    assert done.stdout.strip() == f"pip install 'kpopnet[app] @ {origin}'", done.stderr
