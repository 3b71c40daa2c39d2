"""The reader of glTF 2.0 files, text (.gltf) and binary (.glb); `load` is the entry."""
