// How workgroups share the list of unrepresented pixels.

const LIST_GROUP: u32 = 64u;         // threads
const MAX_LIST_GROUPS: u32 = 4096u;  // workgroups; longer lists take their threads several turns
