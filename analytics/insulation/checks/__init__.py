"""A DC check as arrays: its thermal resistance by the most trusted route that serves, and how well checks repeat.

`resistance` is the door: a check as arrays (`trace`), bad sensors left out (`sensors`, `strays`, `zero`), then the
routes in the order of trust (`routes`): sensors on the iron (`steady`), the `first_minutes`, the `whole_curve`; each
gives an `estimate`. `darkening` takes back what dark surfaces do; `repeatability` says how far two checks differ for no
reason.
"""
