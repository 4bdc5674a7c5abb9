"""What a fluid image is made of: balls, field, camera, look and image buffers. Imports numpy only."""
