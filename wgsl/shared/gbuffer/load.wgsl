// The G-buffer, for passes that do not import the scene's materials.
#import "shared/gbuffer/read.wgsl"

override HAS_COATS: bool = true;  // compiled out where every material is pure Lambert
