"""Scenes with known cameras: photographs of them, and the distance of a solution from the truth.

textures, gallery: pictures to put on a sphere or a plane
scene:             the sphere or plane
rig, plans:        cameras, and sets of them that look at a scene
render:            photos of a scene
score:             how far estimated cameras are from the true ones, px
"""
