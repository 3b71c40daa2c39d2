// The table of virtual point lights, one slot per light. It is a texture, which CPUs loop over fastest.
#import "many_light/vpl/vpl.wgsl"

// vpl_words() texels per slot, in rows of VPL_TABLE_WIDTH texels.
@group(1) @binding(40) var vpl_table: texture_storage_2d<rgba32uint, read>;

const VPL_TABLE_WIDTH: u32 = 2048u;

fn vpl_texel(index: u32) -> vec2u {
    return vec2u(index % VPL_TABLE_WIDTH, index / VPL_TABLE_WIDTH);
}

// Returns a VPL without its lobe.
fn load_vpl(slot: u32) -> Vpl {
    let first = vpl_words() * slot;
    var packed: PackedVpl;
    packed.place = textureLoad(vpl_table, vpl_texel(first));
    packed.light = textureLoad(vpl_table, vpl_texel(first + 1u));
    return unpack_vpl(packed);
}

fn load_vpl_with_lobe(slot: u32) -> Vpl {
    let first = vpl_words() * slot;
    var packed: PackedVpl;
    packed.place = textureLoad(vpl_table, vpl_texel(first));
    packed.light = textureLoad(vpl_table, vpl_texel(first + 1u));
    if (HAS_LOBES) {
        packed.arriving = textureLoad(vpl_table, vpl_texel(first + 2u));
        packed.lobe = textureLoad(vpl_table, vpl_texel(first + 3u));
    }
    return unpack_vpl(packed);
}
