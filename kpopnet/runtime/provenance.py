"""Which code made a file."""

import subprocess
from pathlib import Path


def git_revision() -> dict[str, str | bool] | None:
    """The revision of this code and whether it was changed since; None where it is not in a git repository."""
    root = Path(__file__).parent
    try:
        revision, changes = (
            subprocess.run(["git", *command], cwd=root, capture_output=True, text=True, check=True).stdout.strip()
            for command in (("rev-parse", "HEAD"), ("status", "--porcelain"))
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return {"revision": revision, "dirty": bool(changes)}
