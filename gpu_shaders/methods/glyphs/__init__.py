"""Glyphs: balls as spheres, or liquids as ellipsoids, with OpenGL 3.3.

Each glyph is a rectangle around its picture, and a ray is cast at each pixel of it (Gumhold 2003; Klein and Ertl 2004; so do
Mueller, Grottel and Ertl 2007 show glyphs beside metaballs). The first pass keeps the number of the nearest glyph, with a depth
that drivers may test early; the second one finds the surface once for each pixel.
"""
