"""The method Tile Lists: everything between the balls and the image happens on the graphics processor.

In a frame, each step a compute shader:

- `occlude` draws kernel spheres (Kanamori et al. 2008, section 5.2) into cells of 4 x 4 pixels, some of them first, so that
  most others turn out to be hidden; `occlude_large` those that cover many cells. `pyramid` makes a pyramid over the cells.
- `cull` keeps the balls that may be seen and counts them in their tiles; `scan` says where each tile's list begins; `fill` puts
  the balls there, `sort_short` and `sort_long` bring each list into the order in which the balls begin.
- `cast` walks along each pixel's ray by steps that cannot pass the surface.

Nothing comes back to the CPU before the image, but a few counts: where there were more balls or entries than the buffers hold,
these grow and the frame is made again. The image is the same in every run: lists are sorted by (distance, id).
"""
