"""What people wear: garments on the skin, pieces with a mesh of their own, and the outfits drawn from them."""
