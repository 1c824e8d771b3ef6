"""Pictures of faces from images: view choice, rectification, exposure, blending, filling."""

from recon.texture.refine import camera_sigmas, refine_poses
from recon.texture.texture import texture_faces

__all__ = ["camera_sigmas", "refine_poses", "texture_faces"]
