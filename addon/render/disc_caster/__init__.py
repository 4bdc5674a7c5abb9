"""Disc Caster: surface particles as discs, on the CPU, in the native core (van Kooten, van den Bergen and Telea 2007).

The same simulation and drawing as the method Surface Particles, without OpenGL.
"""
