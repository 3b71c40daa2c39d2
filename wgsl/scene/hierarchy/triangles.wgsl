// The triangles of the meshes to build trees over, each tree in a frame in which its largest coordinate is about 1.

struct Box {
    low: vec3f,
    high: vec3f,
}

struct Frame {
    low: vec3f,    // of the mesh's box, in units of the frame
    scale: f32,    // frame units in a metre, a power of two: areas neither overflow nor vanish, and lose no digit
    cells: f32,    // Morton cells in a unit
}

@group(1) @binding(0) var<storage, read> positions: array<f32>;  // 3 a vertex, metres
@group(1) @binding(1) var<storage, read> corners: array<u32>;    // 3 a triangle
@group(1) @binding(2) var<storage, read> frames: array<Frame>;
@group(1) @binding(3) var<storage, read> trees: array<u32>;      // of each triangle, if there are several

override SEVERAL_TREES: bool = false;

fn tree_of(triangle: u32) -> u32 {
    if (SEVERAL_TREES) {
        return trees[triangle];
    }
    return 0u;
}

fn corner(at: u32) -> vec3f {
    let vertex = 3u * corners[at];
    return vec3f(positions[vertex], positions[vertex + 1u], positions[vertex + 2u]);
}

// Returns the box of a triangle in its tree's frame.
fn triangle_box(triangle: u32) -> Box {
    let a = corner(3u * triangle);
    let b = corner(3u * triangle + 1u);
    let c = corner(3u * triangle + 2u);
    let scale = frames[tree_of(triangle)].scale;
    return Box(min(min(a, b), c) * scale, max(max(a, b), c) * scale);
}
