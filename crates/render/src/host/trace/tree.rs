//! The scene's tree in a CPU's layout: the boxes of a node's eight children side by side, in full precision.

/// Children of a node.
pub(crate) const WIDTH: usize = 8;
/// Bit set in a child that is a leaf. The bits below hold `first triangle << 2 | number of triangles`.
pub(crate) const LEAF: u32 = 1 << 31;

/// A node of `anatomy::Bvh::nodes`, its boxes decoded.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct WideNode {
    /// Least x, y, z, then greatest x, y, z of each child, mm. A missing child has the least above the greatest.
    pub(crate) bounds: [[f32; WIDTH]; 6],
    /// Node of each child, or a [`LEAF`].
    pub(crate) children: [u32; WIDTH],
}

impl WideNode {
    /// Decodes 80 bytes; the layout is that of `anatomy::bvh`.
    pub(crate) fn decode(words: &[u32; 20]) -> Self {
        let bytes: &[u8; 80] = bytemuck::cast_ref(words);
        let mut node = Self { bounds: [[0.0; WIDTH]; 6], children: [0; WIDTH] };
        let mut inner = 0;
        for slot in 0..WIDTH {
            let meta = u32::from(bytes[24 + slot]);
            if meta == 0 {
                for axis in 0..3 {
                    node.bounds[axis][slot] = f32::INFINITY;
                    node.bounds[3 + axis][slot] = f32::NEG_INFINITY;
                }
                continue;
            }
            for axis in 0..3 {
                let step = f32::from_bits(u32::from(bytes[12 + axis]) << 23);
                let least = f32::from_bits(words[axis]);
                node.bounds[axis][slot] = least + f32::from(bytes[32 + 16 * axis + slot]) * step;
                node.bounds[3 + axis][slot] = least + f32::from(bytes[40 + 16 * axis + slot]) * step;
            }
            node.children[slot] = if bytes[15] >> slot & 1 == 1 {
                inner += 1;
                words[4] + inner - 1
            } else {
                // Unary count above the offset of its first triangle.
                LEAF | (words[5] + (meta & 31)) << 2 | (meta >> 5).count_ones()
            };
        }
        node
    }
}
