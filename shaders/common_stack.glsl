// A stack of link words. Its lowest entry, which ends the walk, is the link of a leaf that no tree has.
const uint STACK_END = 0xfffffffcu;
