/** Whether a pointer is over the element that hears of it: a finger keeps its events when it slides off a button. */
export function isOver({ clientX, clientY, currentTarget }: PointerEvent & { currentTarget: HTMLElement }): boolean {
  const { left, right, top, bottom } = currentTarget.getBoundingClientRect();
  return clientX >= left && clientX <= right && clientY >= top && clientY <= bottom;
}
