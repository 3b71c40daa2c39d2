// A surface that receives light and scatters it to the eye.
#import "common/brdf.wgsl"

struct Receiver {
    position: vec3f,
    normal: vec3f,            // shading, towards the viewer
    geometric_normal: vec3f,
    brdf: Brdf,
    frame: mat3x3f,
    w_o: vec3f,               // in the frame
}

fn receiver(position: vec3f, normal: vec3f, geometric_normal: vec3f, brdf: Brdf, to_eye: vec3f) -> Receiver {
    let frame = frame_from_normal(normal);
    return Receiver(position, normal, geometric_normal, brdf, frame, to_eye * frame);
}
