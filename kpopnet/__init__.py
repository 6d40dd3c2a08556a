"""kpopnet estimates 3D human joints from depth images, and computes a dance score from the joints.

After "Real-time dance evaluation by markerless human pose estimation" (Kim & Kim 2018), called "the paper" throughout.

Conventions throughout the package:

- Metres, seconds, radians. Camera frame: x right, y down, z forward. Depth is z, not ray length.
- Depth images are float32 metres in memory, 0 where nothing was measured, and uint16 millimetres on disk.
- Images are (H, W), sequences (T, H, W), joints (T, J, 3), and batch dimensions lead.
- Pixel centres lie at whole pixel coordinates: the principal point of a centred camera is ((W-1)/2, (H-1)/2).
- Right is the person's own right. A missing joint is NaN with confidence 0, never (0, 0, 0).
- Quaternions are w, x, y, z.
"""

import os

# By default OpenMP threads spin while they wait. A training step then takes up to ten times as long when the cores have
# other work, such as preparing batches. The variable must be set before torch is loaded.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

__version__ = "0.1.0"
