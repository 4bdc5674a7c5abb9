"""The method Fitted BVH: Gourmel, Pajot, Paulin, Barthe and Poulin 2010, on the graphics processor.

The native core builds the tree (sections 4 and 5), and shaders send a ray through it for each pixel (5.2): in compute shaders
and storage buffers where hardware has OpenGL 4.3, else in a fragment shader and buffer textures, from the same source. Leaves
are searched by steps that cannot pass the surface, so that no grazing hit is missed; docs/fitted_bvh.md derives them.
"""
