"""The method Vicinity: Mueller, Grottel and Ertl 2007, section 3.1, in shaders of OpenGL 3.3.

Each ball has a list of the balls whose influence spheres overlap its own. It is drawn once, as a rectangle, and each fragment
searches the ball's sphere for the surface with the ball and its list alone; the depth test keeps the nearest. Three things are
not in the paper: kernel spheres are drawn first, so that what is hidden is left out; each ball searches only the part of space
in which it has the least power, so that balls share a ray instead of all searching it; and slopes say where a crossing hides
between two samples. docs/mueller_2007.md has the measurements.
"""
