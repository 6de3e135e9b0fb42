// Thresholds that several scripts share; those with the name of one in tolerance.py have its value.

// Numbers that differ by less are equal. Scale: fraction of their size. Reason: ten printed digits.
const EQUAL = 1e-9;
// Directions, places and values that differ by less are equal to six digits. Scale: fraction of their size. Reason: pages have seven.
const EQUAL_IN_SIX_DIGITS = 1e-6;
// Computed values below this are zero. Scale: fraction of the scale of their unit in a run, or of the largest of their kind. Reason: far above rounding.
const NEGLIGIBLE = 1e-9;
// What is smaller is not seen. Scale: fraction of the size of what is shown; sine or cosine of an angle. Reason: less than a pixel of a thousand.
const VISIBLE = 1e-3;
// Numbers below this are written with an exponent. Scale: 1. Reason: three zeros are counted at a glance.
const SHORT_NUMBER = 1e-3;
// Rotation of the view by a pointer. Unit: rad for each pixel. Reason: half a turn across a page.
const TURN_OF_PIXEL = 0.008;
// Growth of the view by a wheel. Unit: fraction for each pixel. Reason: a notch is a sixth.
const ZOOM_OF_PIXEL = 0.0015;
