// A path by one thread.

// Threads started for each one that traces a path: idle threads between them save waiting within a subgroup.
override LANES_APART: u32 = 1u;

// Whether this thread writes the outputs of its path.
fn is_writer() -> bool {
    return true;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x % LANES_APART != 0u {
        return;
    }
    trace_path(id.x / LANES_APART);
}
