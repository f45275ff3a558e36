"""Images as a camera without distortion would have taken them."""
