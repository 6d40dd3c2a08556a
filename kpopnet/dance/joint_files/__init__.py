"""Files of recorded joints: BVH, npz, CSV, JSON with the names of COCO or Kinect."""
