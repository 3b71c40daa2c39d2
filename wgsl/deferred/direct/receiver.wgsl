// A surface that receives light and scatters it to the eye.
#import "common/brdf.wgsl"

struct Receiver {
    position: vec3f,
    normal: vec3f,            // shading, towards the viewer
    geometric_normal: vec3f,
    brdf: Brdf,
    frame: mat3x3f,
    w_o: vec3f,               // in the frame
    eye_loss: CoatLoss,       // of the coat, towards the eye
}

fn receiver(position: vec3f, normal: vec3f, geometric_normal: vec3f, brdf: Brdf, to_eye: vec3f) -> Receiver {
    let frame = frame_from_normal(normal);
    let w_o = to_eye * frame;
    return Receiver(
        position, normal, geometric_normal, brdf, frame, w_o, coat_loss(brdf.fit, brdf.alpha, w_o.z));
}
