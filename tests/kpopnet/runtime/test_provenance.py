"""Which code a file of figures says that it is of."""

import subprocess

from kpopnet.runtime import provenance


def test_code_that_is_installed_in_anothers_repository_is_not_theirs(tmp_path, monkeypatch):
    def git(*words):
        identity = ("-c", "user.name=a", "-c", "user.email=a@b.c")
        subprocess.run(["git", "-C", str(tmp_path), *identity, *words], check=True, capture_output=True)

    git("init")
    git("commit", "--allow-empty", "-m", "theirs")
    monkeypatch.setattr(provenance, "CHECKOUT", tmp_path)
    assert provenance.git_revision() is None
    (tmp_path / "pyproject.toml").touch()
    assert provenance.git_revision()["dirty"] and len(provenance.git_revision()["revision"]) == 40
