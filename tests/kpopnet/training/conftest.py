"""What a training sets for the whole process is set back."""

import pytest
import torch


@pytest.fixture(scope="module", autouse=True)
def restored_torch():
    """Restores torch's determinism and threads."""
    threads = torch.get_num_threads()
    yield
    torch.use_deterministic_algorithms(False)
    torch.set_num_threads(threads)
