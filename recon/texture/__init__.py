"""Pictures of faces from images: view choice, rectification, exposure, blending, filling."""

from recon.texture.texture import texture_faces

__all__ = ["texture_faces"]
