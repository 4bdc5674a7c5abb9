"""Tile Caster: what a camera sees, on the CPU, in the native core.

Kernel spheres hide what lies behind them (Kanamori, Szego and Nishita 2008, section 5.2), the rest is binned to tiles of
pixels, and packets of sixteen rays walk to the surface by steps that cannot pass it.
"""
