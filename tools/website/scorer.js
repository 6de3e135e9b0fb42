// Which results of a search come first: names before prose, what everybody calls before what few do, pages that explain
// before pages that record why something was decided, and for questions the page that says where to find what.
const PLACES = [["reference/mechanism/mechanism", 4], ["reference/results/result", 3], ["reference/equations", 1], ["find", 12],
  ["decisions/", -8], ["gallery/", -4], ["changelog", -4]];
var Scorer = {
  score: ([page, , , , score]) => score + PLACES.filter(([begin]) => page.startsWith(begin)).reduce((sum, [, more]) => sum + more, 0),
  objNameMatch: 21,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
