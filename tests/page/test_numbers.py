"""Numbers of the form at hand: dragged by their labels, stepped by keys, their errors charted."""

from playwright.sync_api import Page, expect

from tests.tools.browsing import Visit, accessibility_faults

RANGE = "Range (m)"


def scrub(page: Page, label: str, by: float, *, release: bool = True) -> tuple[float, float]:
    """Drag a field by its label, so many pixels to the right; return where the drag ends."""
    place = page.locator("#editor label", has_text=label).first
    place.scroll_into_view_if_needed()
    box = place.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 4.0, box["y"] + box["height"] / 2.0
    page.mouse.move(x, y)
    page.mouse.down()
    for share in (0.25, 0.5, 0.75, 1.0):
        page.mouse.move(x + share * by, y)
    if release:
        page.mouse.up()
    return x + by, y


def test_a_number_is_dragged_by_its_label_in_one_step_to_undo(visit: Visit, page: Page) -> None:
    field = page.get_by_label(RANGE, exact=True)
    with page.expect_request("**/previews?quick=true**"):
        x, y = scrub(page, "Range", 60.0, release=False)
    expect(field).to_have_value("56")
    # a pause: the whole plan follows, and the drag goes on as the same step
    visit.settle()
    expect(page.locator("#verdict tr", has_text="Predicted RMS error")).to_contain_text(" m")
    page.wait_for_timeout(1100)
    page.mouse.move(x + 20.0, y)
    page.mouse.up()
    visit.settle()
    expect(field).to_have_value("58")
    expect(field).not_to_be_focused()
    page.get_by_role("button", name="Undo").click()
    expect(field).to_have_value("50")
    expect(page.locator("#undo")).to_have_attribute("aria-disabled", "true")


def test_shift_drags_ten_times_as_far_and_limits_hold(visit: Visit, page: Page) -> None:
    page.keyboard.down("Shift")
    scrub(page, "Range", 20.0)
    expect(page.get_by_label(RANGE, exact=True)).to_have_value("70")
    scrub(page, "Field of view", -4.0)
    view = page.get_by_label("Field of view (°)", exact=True)
    expect(view).to_have_value("320")
    scrub(page, "Field of view", 200.0)
    expect(view).to_have_value("360")
    scrub(page, "Least separation", -200.0)
    expect(page.get_by_label("Least separation")).to_have_value("0")
    page.keyboard.up("Shift")
    visit.settle()


def test_a_click_on_a_label_goes_to_its_field_and_arrow_keys_step_it(
    visit: Visit, page: Page
) -> None:
    for name, before, after in (
        ("Angular rate (rad/s)", "0.2", "0.21"),
        (RANGE, "50", "51"),
        ("Desynchronise by (rad)", "", ""),
    ):
        field = page.get_by_label(name, exact=True)
        page.locator("label", has_text=name).first.click()
        expect(field).to_be_focused()
        if before:
            expect(field).to_have_value(before)
            field.press("ArrowUp")
            expect(field).to_have_value(after)
    visit.settle()
    assert accessibility_faults(page) == []
