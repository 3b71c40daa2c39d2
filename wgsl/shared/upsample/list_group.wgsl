// The workgroups over the list of unrepresented pixels.

const LIST_GROUP: u32 = 64u;         // threads
const MAX_LIST_GROUPS: u32 = 4096u;  // workgroups; in longer lists each thread takes several pixels
