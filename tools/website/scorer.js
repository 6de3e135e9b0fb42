// Which results of a search come first: names before prose, what everybody calls before what few do, and pages that explain
// before pages that record why something was decided.
const PLACES = { "reference/mechanism": 4, "reference/results": 3, "reference/equations": 1 };
var Scorer = {
  score: ([page, , , , score]) =>
    score + (PLACES[page] || 0) - (page.startsWith("decisions/") ? 8 : page.startsWith("gallery/") ? 4 : 0),
  objNameMatch: 21,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
