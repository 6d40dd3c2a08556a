"""Random tree walks: a peer to judge the tracker and the networks beside.

After Jung, Lee, Heo & Yun, "Random tree walk toward instantaneous 3D human pose estimation" (CVPR 2015), which the paper
compares itself with in Fig. 8; written anew from the idea. Every joint has one regression tree. Asked at a place in space,
with differences of depth around it, the tree answers with a few directions in which the joint may lie. A walk asks, goes one
step in one of the directions, asks again; the joint is expected at the mean of the places it visits. The torso's walk starts
at the middle of the silhouette, every other joint's where its kinematic parent was found. Nothing true enters an estimate.

    image -> model (trees) -> walking -> estimator
             growing, training make the model
"""
