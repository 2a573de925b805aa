/** The page of a robot: what a person does there. */
export const controls = {
  parts: "Parts of this page",
  tabs: { live: "Live", axes: "Axes", io: "I/O", more: "More" },
};
