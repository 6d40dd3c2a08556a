"""Drawing: depth, probability maps and skeletons as RGB images."""
