"""One folder a method: params.py says what it is, method.py runs its shaders."""
