// A path by one thread.

// Threads started for each one that searches, so that fewer lanes of a group wait for each other.
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
