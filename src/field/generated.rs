//! What kernels that Rust writes are made of.

/// Writes into a String, which cannot fail.
macro_rules! line {
    ($text:expr, $($format:tt)*) => {{
        let _ = writeln!($text, $($format)*);
    }};
}
pub(super) use line;

/// Names of a vec4's components.
pub(super) const COMPONENTS: [&str; 4] = ["x", "y", "z", "w"];

/// Threads of a workgroup of every kernel over counts that the device knows: GROUP_SIZE of `shaders/common/group.wgsl`.
#[must_use]
pub fn group_size() -> usize {
    let text = include_str!("../../shaders/common/group.wgsl");
    let stated = text.split_once("const GROUP_SIZE = ").and_then(|(_, rest)| rest.split_once("u;"));
    let size = stated.and_then(|(size, _)| size.parse().ok());
    size.unwrap_or_else(|| unreachable!("shaders/common/group.wgsl states GROUP_SIZE"))
}

/// The rows of a weight gradient's `chunk`, from `begin` to `end`, and where its sums begin.
pub(super) const CHUNK: &str = "    \
    let share = (layer_count() + CHUNKS - 1u) / CHUNKS;
    let begin = min(chunk * share, layer_count());
    let end = min(begin + share, layer_count());
    let base = chunk * MLP_QUADS + tile.first_quad;
";
