"""Pictures of our own scenes without a GPU: meshes, instances, a compiled z-buffer, frames for cameras and people."""
