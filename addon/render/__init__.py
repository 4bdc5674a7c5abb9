"""From balls, a camera and a field to image buffers. The only part that picks methods and back-ends."""
