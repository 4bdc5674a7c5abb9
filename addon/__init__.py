"""The Python side of Meniscus: data (fluid), rendering, files (output) and Blender."""
