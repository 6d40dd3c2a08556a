"""The command that installs an extra: kpopnet is on no package index, so it names the checkout."""

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
