"""Things on the floor in images: how high they are and which pixels show them."""
