"""Surface particles on the graphics processor: their motion and how they are drawn (van Kooten, van den Bergen and Telea 2007).

The motion is that of native/core/src/surface_particles, pass by pass; the native core places particles and fills gaps.
"""
