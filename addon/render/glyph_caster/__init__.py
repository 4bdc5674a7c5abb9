"""Glyph Caster: balls as spheres, or liquids as ellipsoids, on the CPU, in the native core.

Each glyph is intersected exactly at the pixels of its rectangle: so Mueller, Grottel and Ertl 2007 show glyphs beside
metaballs.
"""
