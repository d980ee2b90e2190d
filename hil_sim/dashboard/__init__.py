"""A page in a browser: the firmware and its plant in WebAssembly, or a running bus to look at."""
