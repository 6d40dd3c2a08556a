"""Random tree walk: a baseline for the trackers and the networks.

After Jung, Lee, Heo & Yun, "Random tree walk toward instantaneous 3D human pose estimation" (CVPR 2015), with which the
paper compares itself in Fig. 8; an independent implementation. Each joint has one regression tree. At a position in space,
the tree evaluates depth differences around it and returns a few directions in which the joint may lie. A walk takes a step
in one of these directions and queries the tree again. The estimate is the mean of the visited positions. The walk of the
torso starts at the centre of the silhouette, that of every other joint at the estimate of its kinematic parent.
"""
