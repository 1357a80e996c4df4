// The stability map.

/** Show the map of stored sweeps in an element; data: as map_data.collect() in Python returns it. */
function mountMap(element, data) {
  element.textContent = "No stored sweep: make stability, or make paper, then make explorer.";
}
