// How the list of `guide.wgsl` is shared out among threads.

const REST_GROUP: u32 = 64u;  // threads
// Workgroups; their threads go on with further pixels.
const MAX_REST_GROUPS: u32 = 4096u;
