// Importance sampling of the environment map by the inverse of its CDF: rows first, then a column of that row.
#import "scene/environment.wgsl"
#import "common/random.wgsl"

// CDF along each row; the last column holds the CDF of the rows.
@group(1) @binding(10) var environment_cdf: texture_2d<f32>;

fn environment_direction(uv: vec2f) -> vec3f {
    let phi = TWO_PI * (uv.x - scene.environment_rotation);
    let theta = PI * uv.y;
    return vec3f(sin(phi) * sin(theta), cos(theta), -cos(phi) * sin(theta));
}

// Returns the first column of a row whose cumulative value exceeds u (binary search).
fn find_in_cdf(row: i32, count: i32, u: f32) -> i32 {
    var low = 0;
    var high = count - 1;
    while (low < high) {
        let middle = (low + high) / 2;
        if (textureLoad(environment_cdf, vec2i(middle, row), 0).r > u) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    return low;
}

// Returns the first row whose cumulative value exceeds u.
fn find_row_in_cdf(column: i32, count: i32, u: f32) -> i32 {
    var low = 0;
    var high = count - 1;
    while (low < high) {
        let middle = (low + high) / 2;
        if (textureLoad(environment_cdf, vec2i(column, middle), 0).r > u) {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    return low;
}

// Returns the lower and upper cumulative value of an entry.
fn cdf_interval(column: i32, row: i32) -> vec2f {
    let upper = textureLoad(environment_cdf, vec2i(column, row), 0).r;
    if (column == 0) {
        return vec2f(0.0, upper);
    }
    return vec2f(textureLoad(environment_cdf, vec2i(column - 1, row), 0).r, upper);
}

fn cdf_row_interval(column: i32, row: i32) -> vec2f {
    let upper = textureLoad(environment_cdf, vec2i(column, row), 0).r;
    if (row == 0) {
        return vec2f(0.0, upper);
    }
    return vec2f(textureLoad(environment_cdf, vec2i(column, row - 1), 0).r, upper);
}

// Returns the density of directions in a cell of the table, 1/sr.
fn cell_pdf(cell: vec2i, size: vec2i, sine: f32) -> f32 {
    let row = cdf_row_interval(size.x, cell.y);
    let column = cdf_interval(cell.x, cell.y);
    let share = (row.y - row.x) * (column.y - column.x) * f32(size.x * size.y);
    return share / (TWO_PI * PI * max(sine, 1e-6));
}

// Returns the density with which `sample_light` draws a direction, 1/sr.
fn environment_pdf(direction: vec3f) -> f32 {
    if (!HAS_PICTURED_ENVIRONMENT) {
        return 0.0;
    }
    let size = vec2i(textureDimensions(environment_cdf)) - vec2i(1, 0);
    let cell = clamp(vec2i(environment_uv(direction) * vec2f(size)), vec2i(0), size - 1);
    return scene.environment_pdf * cell_pdf(cell, size, length(direction.xz));
}

// Returns a direction and, in w, its density given that the environment is picked, 1/sr.
fn sample_environment(u: vec2f) -> vec4f {
    let size = vec2i(textureDimensions(environment_cdf)) - vec2i(1, 0);
    let y = find_row_in_cdf(size.x, size.y, u.y);
    let row = cdf_row_interval(size.x, y);
    let x = find_in_cdf(y, size.x, u.x);
    let column = cdf_interval(x, y);
    // Place the sample within the cell by the remainder of u in its interval.
    let inside = vec2f(
        (u.x - column.x) / max(column.y - column.x, 1e-20), (u.y - row.x) / max(row.y - row.x, 1e-20));
    let uv = (vec2f(f32(x), f32(y)) + clamp(inside, vec2f(0.0), vec2f(BELOW_ONE))) / vec2f(size);
    let direction = environment_direction(uv);
    return vec4f(direction, cell_pdf(vec2i(x, y), size, length(direction.xz)));
}
