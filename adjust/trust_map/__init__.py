"""Trust map: how well any new point of the ground can be measured in the images of an adjusted block."""
