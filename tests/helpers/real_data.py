"""Where real depth lies, if it does: the folder `shared/real` beside the checkout, or KPOPNET_REAL_DATA."""

import os
from pathlib import Path

REAL = Path(os.environ.get("KPOPNET_REAL_DATA", Path(__file__).parents[3] / "shared" / "real"))
UTD_MHAD = REAL / "UTD-MHAD"
ITOP_SKELETONS = REAL / "itop_test_gt_skeletons.npz"
ITOP_FRAMES = REAL / "itop_side_test_3frames.npz"
