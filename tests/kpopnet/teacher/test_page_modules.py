"""The page's own modules, by node's test runner; a browser is not needed."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from programs import ROOT

NODE = shutil.which("node")
LEAST_MAJOR = 20


def test_the_modules_of_the_page_do_what_their_tests_say():
    if NODE is None:
        pytest.skip("node is not installed")
    version = subprocess.run([NODE, "--version"], capture_output=True, text=True).stdout
    if int(re.match(r"v(\d+)", version)[1]) < LEAST_MAJOR:
        pytest.skip(f"node {version.strip()} is older than {LEAST_MAJOR}")
    tests = sorted(map(str, (Path(__file__).parent / "page").glob("*.test.mjs")))
    ran = subprocess.run([NODE, "--test", *tests], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert ran.returncode == 0 and len(tests) >= 4, ran.stdout[-4000:] + ran.stderr[-2000:]
