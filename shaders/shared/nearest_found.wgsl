// What the search for the nearest crossing of a ray finds.

const NO_KEY: u32 = 0xffffffffu;

// Triangle in leaf order, and its facing in the lowest bit: 1 if the ray enters.
var<private> nearest_key: u32;
// Whether other crossings may lie within TOUCH_MM of it.
var<private> nearest_crowded: bool;
