"""What the viewport draws by Blender's own graphics module: programs as data, and their shaders."""
