"""OpenGL: the context, the shader preprocessor, the shared shader library and the GPU methods. Sole importer of moderngl."""
