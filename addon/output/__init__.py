"""From image buffers to files. Imports no bpy; OpenEXR only when a file is encoded."""
