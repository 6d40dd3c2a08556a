"""What `make release` writes."""

from datetime import date

import pytest
from programs import ROOT, tool

from kpopnet import __version__
from kpopnet.errors import InputError

release = tool("release")
NEWER = "9.8.7"


@pytest.fixture
def texts():
    return {name: (ROOT / name).read_text(encoding="utf-8") for name in (*release.PLACES, "CHANGELOG.md")}


def test_a_newer_version_is_written_into_every_file_that_states_it(texts):
    texts["CHANGELOG.md"] = "# Changes\n\n## Unreleased\n\n- a change\n\n## 0.0.1\n\n- an old one\n"
    written = release.released(texts, NEWER, date(2026, 12, 1))
    assert written.pop("CHANGELOG.md") == (
        "# Changes\n\n## Unreleased\n\n## 9.8.7 - 2026-12-01\n\n- a change\n\n## 0.0.1\n\n- an old one\n"
    )
    for name, text in written.items():
        assert NEWER in text and text.replace(NEWER, __version__) == texts[name]
    with pytest.raises(InputError, match="nothing has changed"):
        release.released(texts | {"CHANGELOG.md": "## Unreleased\n\n## 0.0.1\n\n- an old one\n"}, NEWER, date(2026, 12, 1))


@pytest.mark.parametrize("version", [__version__, "0.0.9", "1.0", "v1.0.0", "1.0.0rc1"])
def test_a_version_that_is_none_or_not_newer_is_refused(texts, version):
    with pytest.raises(InputError, match=f"newer than {__version__}"):
        release.released(texts, version, date(2026, 12, 1))


def test_a_file_that_states_another_version_is_told(texts):
    with pytest.raises(InputError, match=r"CITATION\.cff: expected it to state version"):
        release.released(texts | {"CITATION.cff": "version: 0.0.1\n"}, NEWER, date(2026, 12, 1))
