"""Pictures of faces from images: view choice, rectification, exposure, blending, filling."""

from recon.texture.refine import refine_poses
from recon.texture.texture import texture_faces

__all__ = ["refine_poses", "texture_faces"]
