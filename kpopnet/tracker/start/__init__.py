"""Where a tracker starts: from the Y pose, from a network's joints, or from anybody who stands or sits upright."""
